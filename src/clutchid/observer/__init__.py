"""On line: the load, the pressure and their bands from position and duty cycles, sample by sample.

An `observer` of a calibrated actuator is a value that does not change; what it knows is a state, which goes in and
comes out: `start`, then `observe` for every block of samples.
"""

from clutchid.observer.by_stroke import StrokeRow, curve, curve_positions, estimates_of, follow_strokes
from clutchid.observer.configuration import Observer, observer, start
from clutchid.observer.following import Observed, observe
from clutchid.observer.run import Loads, ObservedRecording, loads, observe_recording
from clutchid.observer.state import ObserverState
from clutchid.observer.state_file import read_state, write_state

__all__ = [
    "Loads",
    "Observed",
    "ObservedRecording",
    "Observer",
    "ObserverState",
    "StrokeRow",
    "curve",
    "curve_positions",
    "estimates_of",
    "follow_strokes",
    "loads",
    "observe",
    "observe_recording",
    "observer",
    "read_state",
    "start",
    "write_state",
]
