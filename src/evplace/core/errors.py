"""Every error that evplace raises on purpose.

EvplaceError
├── SettingsError            a setting is unknown or has a value that cannot be used
├── PartError                another package's part cannot be loaded, or breaks what its family promises
├── MissingExtraError        an optional dependency is needed: the text carries the pip line
├── InputError               what was given cannot be used
│   ├── RecordingError       an event recording
│   │   ├── UnsupportedError     an encoding, codec, stream type or version that is not read
│   │   └── DamagedRecordingError   the good part was delivered, then the data broke off
│   │       └── DoubtfulRecordingError   all was delivered, but it can hardly be a recording
│   ├── TrackError           a GPS log or positions
│   ├── DatasetError        a folder of a data set: of no known layout, or a part of it is missing
│   ├── TraverseError        a traverse folder, or images and times that do not fit
│   │   └── UnreadableImageError    one image file is damaged: the others can be used
│   ├── PlaceMapError        a map: wrong checksum, made with other settings, not a map
│   ├── ScoresError          score rows that a matcher cannot use
│   └── EvaluationError      truth and answers that do not fit
└── OutputError              an output exists, is being written by another process, or the disk is full
    ├── WorkerLostError      a process was killed before its job was done
    └── WorkerFailedError    a process ended otherwise than by an error of these

The text of each says what is wrong, what was given, and what to do. It names the library's arguments in
backquotes, `time_unit` or `fps=30`, and never a flag; the command line shows such words as its flags,
--time-unit and --fps 30. Settings, which are keys of a file as well, stand in quotes: 'dt'. Only the command
line catches EvplaceError: it prints one line and exits with 2, or with 3 where a good part was used.
"""

from __future__ import annotations


class EvplaceError(Exception):
    """Base of all errors raised on purpose."""


class SettingsError(EvplaceError):
    """A setting is unknown or has a value that cannot be used."""


class PartError(EvplaceError):
    """Another package's part cannot be loaded, or breaks what its family promises."""


class MissingExtraError(EvplaceError):
    """An optional dependency is missing."""

    def __init__(self, package: str, extra: str, purpose: str) -> None:
        super().__init__(
            f"{purpose} needs the package '{package}', which is not installed: pip install 'evplace[{extra}]'"
        )


class InputError(EvplaceError):
    """What was given cannot be used."""


class RecordingError(InputError):
    """An event recording cannot be read."""


class UnsupportedError(RecordingError):
    """A recording is whole, but of an encoding, codec, stream type or version that is not read."""


class DamagedRecordingError(RecordingError):
    """A recording broke off: every complete packet before the fault was delivered."""


class DoubtfulRecordingError(DamagedRecordingError):
    """All was delivered, but most of it was left out, or no camera sends events at such a rate."""


class TrackError(InputError):
    """A GPS log or a set of positions cannot be used."""


class DatasetError(InputError):
    """A folder of a data set is of no known layout, or a part of it is missing."""


class TraverseError(InputError):
    """A traverse folder, or images and times, cannot be used."""


class UnreadableImageError(TraverseError):
    """One image file is damaged: it can be left out."""


class PlaceMapError(InputError):
    """A map cannot be used."""


class ScoresError(InputError):
    """Score rows cannot be used by a matcher."""


class EvaluationError(InputError):
    """Truth and answers do not fit each other."""


class OutputError(EvplaceError):
    """An output cannot be written."""


class WorkerLostError(OutputError):
    """A process was killed, or its machine was lost, before its job was done."""


class WorkerFailedError(OutputError):
    """A process that did a job ended by an error that is none of these."""
