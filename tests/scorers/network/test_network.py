"""Table 1, its training, and its twin in ONNX."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from numpy.typing import NDArray
from safetensors.numpy import load

from evplace.core.errors import PlaceMapError, SettingsError, TraverseError
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer
from evplace.placemap import PlaceMap, train
from evplace.places import PlaceGrid
from evplace.scorers import Learning
from evplace.scorers._network import checkpoint
from evplace.scorers._network.training import batches, set_rate, train_network

torch = pytest.importorskip("torch", reason="the network needs the extra 'train'")

from evplace.scorers._network.network import Network, NetworkSettings, scaled, to_input, weights_of  # noqa: E402 - only with torch
from evplace.scorers._network.network_onnx import OPERATORS, SCALE, check_graph, onnx_bytes  # noqa: E402
from evplace.scorers.network import GRAPH, NetworkRows, TrainSettings  # noqa: E402

Images = NDArray[np.uint8]


def some_images(n: int = 5, shape: tuple[int, ...] = (90, 160)) -> Images:
    return np.random.default_rng(3).integers(0, 256, (n, *shape), np.uint8)


def test_table_1_has_the_papers_sizes() -> None:
    network = Network(104, (1, 90, 160), NetworkSettings())
    assert network.full1.in_features == 7040
    assert network.full3.out_features == 104
    assert sum(p.numel() for p in network.parameters()) == 1_528_908
    assert network.norm1.eps == 1e-5
    assert network.norm1.momentum == 0.1


def test_an_odd_number_of_places_takes_the_whole_part_of_one_and_a_half() -> None:
    assert Network(5, (1, 90, 160), NetworkSettings()).full2.out_features == 7


def test_layers_in_the_order_of_the_table() -> None:
    """MP(ReLU(conv)) then batch norm, with ReLU on the last layer as printed."""
    network = Network(3, (1, 90, 160), NetworkSettings(last_relu=True)).eval()
    x = to_input(some_images(2))
    relu, pool = torch.relu, torch.nn.functional.max_pool2d
    plain = network.norm1(pool(relu(network.conv1(x)), 2))
    plain = network.norm2(pool(relu(network.conv2(plain)), 2))
    plain = pool(relu(network.conv3(plain)), 2).flatten(1)
    plain = relu(network.full3(relu(network.full2(relu(network.full1(plain))))))
    torch.testing.assert_close(network(x), plain)
    assert (network(x) >= 0).all()


@pytest.mark.parametrize("shape", [(90, 160), (90, 160, 3)])
@pytest.mark.parametrize("last_relu", [False, True])
@pytest.mark.parametrize("own_scale", [False, True])
def test_the_onnx_graph_says_what_torch_says(
    shape: tuple[int, ...], last_relu: bool, own_scale: bool
) -> None:
    torch.manual_seed(1)
    image = (3 if len(shape) == 3 else 1, 90, 160)
    network = Network(7, image, NetworkSettings(last_relu=last_relu, own_scale=own_scale))
    images = some_images(5, shape)
    images[0] = 0
    images[1] //= 50
    network(to_input(images))  # gives the batch norms statistics of their own
    network.eval()
    scores = NetworkRows(onnx_bytes(weights_of(network), image, last_relu, own_scale)).rows(images)
    wanted = torch.softmax(network(to_input(images)), 1).detach().numpy()
    np.testing.assert_allclose(scores, wanted, atol=1e-6)


def test_with_a_scale_of_its_own_more_events_all_over_change_little() -> None:
    images = to_input(some_images(4) // 3)
    ours = scaled(images)
    torch.testing.assert_close(scaled(3 * images), ours, rtol=0.1, atol=0)
    torch.testing.assert_close(
        ours.square().mean(dim=(2, 3)).sqrt(), torch.full((4, 1), SCALE), rtol=0.2, atol=0
    )
    assert not scaled(torch.zeros(1, 1, 8, 8)).any()


def test_training_learns_the_drive(network_map: PlaceMap, day: Traverse, places: PlaceGrid) -> None:
    rows = Localizer(network_map).rows(day.images)
    labels = places.label(day.xy)
    assert (rows.argmax(axis=1) == labels).mean() > 0.9
    np.testing.assert_allclose(rows.sum(axis=1), 1, atol=1e-5)


def test_a_seed_gives_the_same_weights(day: Traverse, places: PlaceGrid) -> None:
    first, second, other = (train(day, places, "network", steps=3, batch=8, seed=seed) for seed in (5, 5, 6))
    assert first.content == second.content
    assert first.content != other.content


@pytest.mark.parametrize(
    "settings", [TrainSettings(dropout=0.2), TrainSettings.presets["tuned"], TrainSettings(augment="light")]
)
def test_a_killed_run_goes_on_to_the_same_weights(
    settings: TrainSettings,
    day: Traverse,
    places: PlaceGrid,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(checkpoint, "EVERY", 2)
    short = replace(settings, steps=7, batch=8)
    whole = train(day, places, short)
    file = tmp_path / "run.checkpoint"

    def kill(step: int, steps: int, loss: float) -> None:
        if step == 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(day, places, short, learning=Learning(kill, file))
    steps_left: list[int] = []
    learning = Learning(lambda step, steps, loss: steps_left.append(step), file)
    resumed = train(day, places, short, learning=learning)
    assert steps_left == [5, 6, 7]
    assert resumed.content == whole.content
    assert not file.exists()


def test_a_checkpoint_of_another_run_is_passed_over(day: Traverse, places: PlaceGrid, tmp_path: Path) -> None:
    file = tmp_path / "run.checkpoint"
    file.write_bytes(b"cut")
    after_all = train(day, places, "network", steps=2, batch=8, learning=Learning(checkpoint=file))
    assert after_all.content[GRAPH] == train(day, places, "network", steps=2, batch=8).content[GRAPH]


def test_batches_are_shuffled_passes() -> None:
    found = list(batches(10, 4, seed=0, first=0, steps=6))
    assert [len(batch) for batch in found] == [4, 4, 2, 4, 4, 2]
    assert sorted(np.concatenate(found[:3])) == list(range(10))
    later = list(batches(10, 4, seed=0, first=4, steps=6))
    assert [batch.tolist() for batch in later] == [batch.tolist() for batch in found[4:]]


def test_sgd_and_epochs(day: Traverse, places: PlaceGrid) -> None:
    seen: list[int] = []
    settings = TrainSettings(optimiser="sgd", epochs=2, batch=32)
    train(day, places, settings, learning=Learning(lambda step, steps, loss: seen.append(steps)))
    assert seen == [2 * -(-len(day) // 32)] * seen[0]


@pytest.mark.parametrize(
    "changed",
    [
        {"weight_decay": 0.5}, {"label_smoothing": 0.2}, {"augment": "events"}, {"augment": "light"},
        {"own_scale": True},
    ],
)  # fmt: skip
def test_each_setting_changes_the_weights(
    changed: dict[str, object], day: Traverse, places: PlaceGrid
) -> None:
    plain, other = (train(day, places, "network", steps=2, batch=8, **values) for values in ({}, changed))
    assert plain.content != other.content


@pytest.mark.parametrize("optimiser", ["adam", "sgd"])
def test_weights_decay_by_the_setting_alone(
    optimiser: Literal["adam", "sgd"], day: Traverse, places: PlaceGrid
) -> None:
    """A rate so small that nothing is learned, and a decay so large that it shows."""
    first, last = (
        load(
            train(
                day,
                places,
                "network",
                optimiser=optimiser,
                learning_rate=1e-9,
                weight_decay=decay,
                steps=1,
                batch=8,
            ).content["weights.safetensors"]
        )
        for decay in (0.0, 5e8)
    )
    np.testing.assert_allclose(last["full2.weight"], first["full2.weight"] / 2, atol=1e-6)


def test_the_rate_falls_along_half_a_cosine() -> None:
    optimiser = torch.optim.SGD([torch.zeros(1)], lr=1.0)
    for done, constant, cosine in ((0.0, 0.1, 0.1), (0.5, 0.1, 0.05), (0.75, 0.1, 0.0146447), (1, 0.1, 0.0)):
        for schedule, rate in (("constant", constant), ("cosine", cosine)):
            set_rate(optimiser, TrainSettings(learning_rate=0.1, schedule=schedule), done)  # type: ignore[arg-type]
            assert optimiser.param_groups[0]["lr"] == pytest.approx(rate, abs=1e-6)


def test_presets_say_what_the_paper_and_its_notebook_say() -> None:
    paper = TrainSettings.presets["paper"]
    assert (paper.last_relu, paper.learning_rate, paper.batch, paper.steps) == (True, 0.001, 64, 1000)
    notebook = TrainSettings.presets["notebook"]
    assert (notebook.dropout, notebook.epochs) == (0.5, 1000)
    for printed in (paper, notebook):
        assert (printed.augment, printed.schedule) == ("none", "constant")
        assert (printed.weight_decay, printed.label_smoothing) == (0, 0)


def test_one_image_at_a_time_says_what_a_batch_says(network_map: PlaceMap, day: Traverse) -> None:
    scorer = Localizer(network_map)
    single = np.concatenate([scorer.rows(image[None]) for image in day.images])
    np.testing.assert_allclose(single, scorer.rows(day.images), atol=1e-6)


@pytest.mark.parametrize(
    "wrong",
    [
        {"batch": 0}, {"steps": -1}, {"seed": -1}, {"learning_rate": 0.0}, {"epochs": -1},
        {"weight_decay": -0.1}, {"label_smoothing": 1.0}, {"label_smoothing": -0.1},
    ],
)  # fmt: skip
def test_settings_that_cannot_be_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(SettingsError):
        TrainSettings(**wrong)  # type: ignore[arg-type]


def test_no_image_with_a_place_is_an_error(day: Traverse, places: PlaceGrid) -> None:
    lost = Traverse(day.images, day.t_us, day.counts, None, day.recipe)
    with pytest.raises(TraverseError, match="no image of the traverse has a place"):
        train(lost, places, "network", steps=1)


def test_small_images_are_refused() -> None:
    with pytest.raises(SettingsError, match="at least 8x8"):
        train_network(
            some_images(2, (7, 7)),
            np.zeros(2, np.int64),
            np.ones(2, np.bool_),
            1,
            TrainSettings(),
            Learning(),
        )


def test_a_network_too_large_to_be_saved_is_refused_before_it_is_made() -> None:
    with pytest.raises(SettingsError, match=r"12000 places has .* million weights, at most 500 .* larger"):
        Network(12_000, (1, 45, 80), NetworkSettings())


def test_one_place_only_is_learned(day: Traverse) -> None:
    assert day.track is not None
    one = PlaceGrid.from_track(day.track, cell_m=1e6)
    learned = train(day, one, "network", steps=1, batch=4)
    assert Localizer(learned).rows(day.images[:2]).tolist() == [[1.0], [1.0]]


def image_of(model: Any) -> Any:
    return model.graph.input[0].type.tensor_type.shape


def test_a_graph_of_other_operators_is_refused(network_map: PlaceMap) -> None:
    """A loop could run for ever, and weights in other files would be read from anywhere."""
    onnx = pytest.importorskip("onnx")
    network = network_map.content["network.onnx"]
    assert isinstance(network, bytes)
    check_graph(network)
    model = onnx.load_from_string(network)
    assert {node.op_type for node in model.graph.node} == OPERATORS - {"Add", "GlobalLpPool"}
    for change, words in (
        (lambda one: setattr(one.graph.node[3], "op_type", "Loop"), "it holds 'Loop'"),
        (lambda one: setattr(one.graph.node[3], "domain", "someone"), "it holds 'someone'"),
        (lambda one: one.functions.add(), "it holds 'functions of its own'"),
        (
            lambda one: one.graph.initializer[0].external_data.add(key="location", value="x"),
            "weights lie in other files",
        ),
        (lambda one: setattr(one.graph.initializer[0], "data_location", 1), "weights lie in other files"),
        (lambda one: one.graph.node[2].attribute[0].ints.__setitem__(0, 50_000), "layers too large"),
        (lambda one: one.graph.node.extend([one.graph.node[3]] * 99), "too many"),
        (
            lambda one: setattr(one.graph.input[0].type.tensor_type.shape.dim[2], "dim_value", 10**8),
            "cannot be run|takes images",
        ),
        (lambda one: one.graph.input[0].type.tensor_type.shape.dim.pop(), "cannot be run|takes images"),
    ):
        changed = onnx.load_from_string(network)
        change(changed)
        with pytest.raises(PlaceMapError, match=words):
            NetworkRows(changed.SerializeToString())


def test_a_damaged_graph_is_one_line(
    network_map: PlaceMap, night: Traverse, capsys: pytest.CaptureFixture[str]
) -> None:
    network = network_map.content["network.onnx"]
    assert isinstance(network, bytes)
    rng = np.random.default_rng(0)
    for _ in range(200):
        damaged = bytearray(network)
        damaged[rng.integers(0, min(len(damaged), 4000))] ^= 1 << int(rng.integers(0, 8))
        try:
            NetworkRows(bytes(damaged)).rows(night.images[:1])
        except PlaceMapError as error:
            assert "\n" not in str(error)  # noqa: PT017 - some bits make no difference
    for size in (0, 1, 5, 100, len(network) - 1):
        with pytest.raises(PlaceMapError):
            NetworkRows(network[:size])
    assert not capsys.readouterr().out
