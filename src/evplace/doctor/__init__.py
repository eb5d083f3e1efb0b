"""What is wrong with a recording, before it costs a day: one pass over it, findings with advice.

To add an examination, add one file and its test. The file holds `OF`, the kinds of subject that it is for
("events", "frames" or both), and a class `Check`, made for one `Subject`, with two methods:

- `see(part)` takes the next packet of events, or the next frame as (t_us, image), in bounded memory;
- `outcome()`, called once after the last, gives its findings and what can be drawn.

What several need is measured once, by the subject itself. The limits are ours: the paper examines nothing.
"""

from __future__ import annotations

from evplace.doctor._drawing import as_json, check_drawing, draw
from evplace.doctor._examining import examine, examine_log
from evplace.doctor._outcome import STATES, Curve, Examination, Finding, Map, Outcome
from evplace.doctor._subject import Subject

__all__ = [
    "STATES",
    "Curve",
    "Examination",
    "Finding",
    "Map",
    "Outcome",
    "Subject",
    "as_json",
    "check_drawing",
    "draw",
    "examine",
    "examine_log",
]
