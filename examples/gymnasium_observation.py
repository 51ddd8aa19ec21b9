"""Let an agent hear: a gymnasium environment whose observation holds the sound of each step."""

import gymnasium
import matplotlib.pyplot as plt
import numpy as np

import sonic_bullet as sb
from sonic_bullet.environments import SoundObservation, log_mel

SR = 48_000
env = SoundObservation(
    gymnasium.make("HalfCheetah-v5"),  # unmodified; a PyBullet environment works the same
    sr=SR,
    materials={"bfoot": "wood", "ffoot": "wood"},
)
env.action_space.seed(1)
observation, info = env.reset(seed=1)
print(env.observation_space)
heard = []
for _ in range(30):
    observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
    heard.append(observation["audio"])  # float32 (1, 2400), pascals
env.close()

audio = np.concatenate(heard, axis=1)
plt.figure(figsize=(8, 3), layout="constrained")
plt.imshow(log_mel(audio, SR)[0], origin="lower", aspect="auto", extent=(0, audio.shape[1] / SR, 0, 64))
plt.xlabel("time in s"), plt.ylabel("mel band"), plt.savefig("gymnasium_observation.png")
sb.write_audio("gymnasium_observation.flac", audio, SR, peak_dbfs=-1)
