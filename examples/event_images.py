"""The paper's event images of a recording, one PNG each.

python examples/event_images.py night.aedat4 pictures
"""

import sys
from pathlib import Path

from PIL import Image

import evplace as ev


def main(recording: str, folder: str) -> None:
    """Write one picture for each 1/30 s."""
    Path(folder).mkdir(exist_ok=True)
    for number, image in enumerate(ev.open_traverse(recording).images):
        Image.fromarray(image).save(Path(folder) / f"{number:05d}.png")


if __name__ == "__main__":
    main(*sys.argv[1:])
