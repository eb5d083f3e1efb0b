"""evplace as a baseline of Event-LAB: copy this file and evplace_vpr.yaml into its folder `baselines`.

Then name the class in baselines/get_baseline.py and the command in config.yaml, as its documentation says,
and install evplace into its environment. It reads the recordings that Event-LAB has formatted, learns the
reference by evplace's own scorers, and saves one matrix (references, queries), larger is better.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import yaml
from baselines.EventBaselineLab import EventBaseline

import evplace as ev

HERE = Path(__file__).parent
RUN_LENGTH = 1
"""Images in a place: Event-LAB has a truth of its own, so each image is one."""


class evplace_vpr_baseline(EventBaseline):
    """The reference's images are the map; the scorer is a setting."""

    def __init__(self) -> None:
        super().__init__()
        self.name = "evplace_vpr"
        self.baseline_config = yaml.safe_load((HERE / "evplace_vpr.yaml").read_text("utf-8"))
        self.outdir = "./output/evplace_vpr"
        self.matrix_type = "similarity"

    def format_data(self, config, dataset_config, reference, query, timewindow) -> None:  # type: ignore[no-untyped-def]
        """Where the recordings lie, and where the matrix goes."""
        about = [sequence.get_dataset_info() for sequence in (reference, query)]
        self.recordings = [one["hdf5_path"] for one in about]
        self.size = tuple(dataset_config["dataset"]["resolution"])
        self.config, self.window_s = config, f"{timewindow}/1000"
        self.ref_name, self.query_name = (one["sequence_name"] for one in about)
        pair = f"{self.ref_name}_{self.query_name}"
        window = f"{config['frame_generator']}_{timewindow}"
        self.output_dir = Path(self.outdir, about[0]["dataset_name"], pair, window)
        self.output_dir.mkdir(parents=True, exist_ok=True)

    def build_execute(self, config, data_config, ground_truth) -> None:  # type: ignore[no-untyped-def]
        """Nothing is built."""
        self.ground_truth = ground_truth

    def run(self) -> None:
        """Save the scores of every query with every reference."""
        reference, query = (
            ev.open_traverse(path, size=self.size, dt=self.window_s) for path in self.recordings
        )
        places = ev.PlaceRuns(len(reference), RUN_LENGTH)
        learned = ev.train(reference, places, self.baseline_config["scorer"], matcher="best")
        rows = ev.Localizer(learned).answers(query, "hindsight").rows
        matrix = np.full((len(reference), len(query)), rows.min(), np.float32)
        matrix[np.flatnonzero(reference.counts)] = np.asarray(rows).T
        np.save(self.output_dir / "similarity_matrix.npy", matrix)

    def parse_results(self, GT) -> None:  # type: ignore[no-untyped-def]
        """Event-LAB's own figures."""
        matrix = np.load(self.output_dir / "similarity_matrix.npy")
        pair, tolerance = f"{self.ref_name}_{self.query_name}", self.config.get("ground_truth_tolerance", 0.0)
        rows, curves = self.run_metrics(
            ["similarity_matrix"], [matrix], np.load(GT), "", self.name, pair, matrix_type=self.matrix_type,
            outdir=str(self.output_dir), tolerance=tolerance,
        )  # fmt: skip
        self.save_results(rows, curves, self.name, pair)

    def cleanup(self) -> None:
        """Nothing is left."""
