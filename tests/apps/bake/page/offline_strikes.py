"""Strikes as a page plays them, without a loudspeaker."""

from __future__ import annotations

import base64
import json
from typing import Any

import numpy as np

from sonic_bullet.records import Array
from tests.made.chromium import Browser

SR, SECONDS = 48_000, 1.0

# Strikes given as places and impulses, or as gains of the modes, and silences between them, rendered without a
# loudspeaker by the page's own worklet, in pascals at 1 m.
OFFLINE = """(async () => {
  const wanted = JSON.parse(%r), context = new OfflineAudioContext(1, wanted.seconds * wanted.sr, wanted.sr);
  const { freq_hz, decay_per_s, pressure_re, pressure_im } = page.modes;
  const orders = [{ modes: { freq_hz, decay_per_s, pressure_re, pressure_im } }];
  for (const one of wanted.strikes) {
    if (one.silence) { orders.push(one); continue; }
    const gain = one.gain ?? gainAt(page.body, page.modes, { corner: [one.point], weight: [1] }, one.impulse_n_s);
    orders.push({ strike: { at_s: one.at_s, gain, contact_s: one.contact_s } });
  }
  const bank = await bankIn(context, orders);
  bank.connect(context.destination);
  const bytes = new Uint8Array((await context.startRendering()).getChannelData(0).buffer);
  let text = "";
  for (let i = 0; i < bytes.length; i += 32768) text += String.fromCharCode(...bytes.subarray(i, i + 32768));
  return btoa(text);
})()"""


def played(browser: Browser, strikes: list[dict[str, Any]], seconds: float = SECONDS) -> Array:
    wanted = json.dumps({"strikes": strikes, "sr": SR, "seconds": seconds})
    return np.frombuffer(base64.b64decode(browser.value(OFFLINE % wanted)), np.float32).astype(float)


def played_gains(browser: Browser, gain: list[float], contact_s: float) -> Array:
    return played(browser, [{"gain": gain, "contact_s": contact_s, "at_s": 0}])
