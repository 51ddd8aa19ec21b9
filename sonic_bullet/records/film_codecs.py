"""Audio codecs of films, and which containers players know them in."""

from typing import NamedTuple


class FilmCodec(NamedTuple):
    """Audio codec of ffmpeg: bits a second a channel, 0: any; block, 0: the last may be short, and delay in samples."""

    name: str
    sample: str
    bits_per_s: int = 0
    block: int = 0
    delay: int = 0


CODECS = {
    "aac": FilmCodec("aac", "fltp", 128_000, 1024, 1024),
    "pcm": FilmCodec("pcm_s24le", "s32"),
    "flac": FilmCodec("flac", "s32"),
    "opus": FilmCodec("libopus", "flt", 96_000),
    "mp3": FilmCodec("libmp3lame", "fltp", 128_000, 1152, 1105),
}
CONTAINERS = {".mp4": ("aac", "mp3"), ".mov": ("pcm", "aac"), ".mkv": ("flac", "opus", "pcm", "aac", "mp3")}
"""Extension -> codecs that players know there, the usual one first."""

USUAL_CODECS = ", ".join(f"{extension[1:]} {codecs[0]}" for extension, codecs in CONTAINERS.items())
"""Each container's usual codec, in words."""
