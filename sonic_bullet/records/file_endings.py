"""How the names of scenes' and sounds' files end, and what each sound file can hold."""

from typing import Literal, NamedTuple

GLTF_ENDINGS = (".gltf", ".glb")
SCENE_ENDINGS = (".py", *GLTF_ENDINGS)


class AudioFormat(NamedTuple):
    """A format of sound files: container and default sample format, in libsndfile's names.

    text: where the file states its full scale: in chunks of RIFF, which hold cue points too, in a comment, or nowhere.
    over_4_gib: whether its sizes have more than 32 bits.
    """

    container: str
    subtype: str
    text: Literal["chunks", "comment", "nowhere"] = "comment"
    over_4_gib: bool = True


AUDIO_FORMATS = {
    ".wav": AudioFormat("WAV", "FLOAT", "chunks", over_4_gib=False),
    ".rf64": AudioFormat("RF64", "FLOAT", "chunks"),
    ".w64": AudioFormat("W64", "FLOAT", "nowhere"),
    ".flac": AudioFormat("FLAC", "PCM_24"),
    ".ogg": AudioFormat("OGG", "VORBIS"),
    ".aif": AudioFormat("AIFF", "FLOAT", over_4_gib=False),
    ".aiff": AudioFormat("AIFF", "FLOAT", over_4_gib=False),
    ".caf": AudioFormat("CAF", "FLOAT"),
}
"""Formats by ending: all that one more of libsndfile's needs is an entry here."""
