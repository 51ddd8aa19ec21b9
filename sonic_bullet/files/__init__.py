"""Read and write audio, contact logs, models, meshes and cases; files are written whole or not at all.

    samples (channels, n) Pa -> scale -> check -> clip and count -> partial file -> read back -> fsync -> NAME.EXT
    ContactLog | ModalModel  -> arrays + one JSON entry, no pickle -> partial file -> fsync -> NAME.EXT

`audio` writes sound at the level that `levels` finds, `recordings` reads it, `logs` and `models` write contact logs and
modal models (`logs` describes both), `meshes` and `cases` read meshes and cases, `presets` materials, of which
`materials` holds the package's. What they stand on is in `storage`: the npz of arrays (storage/container.py), the
boundary of all readers (storage/reading.py), whole files (storage/atomic.py).
"""

from sonic_bullet.files.audio import AudioWriter, check_audio_output, write_at_level, write_audio
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.files.levels import check_sr
from sonic_bullet.files.logs import read_log, write_log
from sonic_bullet.files.loudness.audio_report import AudioReport
from sonic_bullet.files.models import read_model, write_model
from sonic_bullet.files.recordings import live_channel, read_audio, read_audio_scale, read_channel
from sonic_bullet.files.storage.atomic import cannot, check_output, kept_name, replace_file

__all__ = [
    "AudioReport",
    "AudioWriter",
    "ContactLog",
    "cannot",
    "check_audio_output",
    "check_output",
    "check_sr",
    "kept_name",
    "live_channel",
    "read_audio",
    "read_audio_scale",
    "read_channel",
    "read_log",
    "read_model",
    "replace_file",
    "write_at_level",
    "write_audio",
    "write_log",
    "write_model",
]
