"""The sound of an environment as a part of its observation.

    env.step -> stepSimulation, hooked, some times -> Listener -> the frames of these steps -> observation["audio"]

An episode begins in silence when `reset` returns; steps made by `reset` itself are not part of it.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from fractions import Fraction
from math import ceil
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Dict
from gymnasium.spaces.utils import flatten
from gymnasium.utils import RecordConstructorArgs

from sonic_bullet.apps.environments.episode_world import connected_client, episode_world, same_client, step_length
from sonic_bullet.apps.environments.repeated_episodes import RepeatedEpisodes
from sonic_bullet.apps.environments.sounding_cast import (
    Cast,
    MaterialsLike,
    add_fillable,
    as_materials,
    cast_of,
    same_cast,
)
from sonic_bullet.engine.runtime.clock import exact_step
from sonic_bullet.files import check_sr
from sonic_bullet.options.render import DEFAULT_MICROPHONE
from sonic_bullet.records import Air, Array, Material, channels_of
from sonic_bullet.records.coerce import as_flag, as_kind, as_number, as_whole
from sonic_bullet.records.errors import AudioError, SceneError
from sonic_bullet.records.sensors import MicrophoneLike
from sonic_bullet.session import Listener, attach
from sonic_bullet.session.arguments import as_sensors
from sonic_bullet.session.drawn_recording import ChainSpread, RecordingChain, RecordingState, draw_chain, record


class SoundObservation(gymnasium.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """A gymnasium environment whose observation has "audio", the sound of its PyBullet or MuJoCo world.

    The observation space is a Dict: the keys of the environment's own, or "observation" where that is not a Dict, and
    "audio". That is float32 (channels, ceil(sr·T)) in pascals, T the simulated time of one env.step: the newest samples
    last, before them zeros. The number of new ones is info["audio_count"], not part of the observation, as a policy
    learns nothing from it; these counts sum to floor(sr·time since reset). As a listener's frames, audio lags physics
    by three physics steps. info["contacts_differ"] is present, and True, from the env.step on in which the simulator
    gave other poses or contacts than in the first episode of the same seed and actions.

    Parameters
    ----------
    microphones, seed, air, image
        As of `attach`.
    materials
        What sounds, found anew after every reset. A material: every link with a collision shape; those that cannot be
        meshed are named in a SceneWarning and stay silent. A mapping from a body's name or id, or (either, link), to a
        material or keywords of `Listener.add`. A function of the client that returns one.
    client
        Of PyBullet, or MuJoCo's (model, data); None: found among the environment's attributes.
    step_s
        T; None: measured, on another environment of the same spec where one can be made, else by a reset and a step of
        this one.
    average
        Whether "audio" is the mean of all channels, one channel, as of contact microphones on one input.
    joints
        By a body's id, springs of its joints, see `World.hold_joints`; ``recording`` may vary them.
    recording
        What a recording would add, drawn for each episode by ``seed`` and the seed of its reset, or its number without
        one: info["recording"] of `reset` has the numbers. None: nothing.

    Raises
    ------
    SceneError
        There is no client or step, or the observation has "audio" already.
    AudioError, MaterialError, RecordError
        An argument is not valid.
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        sr: int = 48_000,
        *,
        microphones: MicrophoneLike = DEFAULT_MICROPHONE,
        materials: MaterialsLike = "plastic",
        client: Any = None,
        step_s: float | None = None,
        seed: int = 0,
        air: Air | None = None,
        image: bool = False,
        recording: ChainSpread | None = None,
        average: bool = False,
        joints: Mapping[Any, Mapping[Any, tuple[float, float]]] | None = None,
    ) -> None:
        given: dict[str, Any] = {
            "sr": sr,
            "microphones": microphones,
            "materials": materials,
            "client": client,
            "step_s": step_s,
        }
        given |= {
            "seed": seed,
            "air": air,
            "image": image,
            "recording": recording,
            "average": average,
            "joints": joints,
        }
        RecordConstructorArgs.__init__(self, _disable_deepcopy=True, **given)
        gymnasium.Wrapper.__init__(self, env)
        self._options: dict[str, Any] = {
            "sr": check_sr(sr),
            "microphone": as_sensors(microphones, "microphones"),
            "seed": as_whole(seed, "seed", "give a whole number, 0 or more", least=0),
            "air": None if air is None else as_kind(air, Air, "air", "give an Air, or leave it out"),
            "image": as_flag(image, "image"),
        }
        if not self._options["microphone"]:
            raise AudioError("there is no microphone, so there is no sound to observe", "give microphones=(x, y, z)")
        self._materials, self._client = as_materials(materials), client
        self._step_s = exact_step(as_length(step_s)) if step_s is not None else step_length(env, client)
        self._dt_s, self._most = 0.0, 0
        self._silent: set[Hashable] = set()
        self._cast: Cast = {}
        self._left_out: Cast = {}
        self._added = 0
        self._listener: Listener | None = None
        self._episodes = RepeatedEpisodes()
        remedy = "give a ChainSpread, or leave it out"
        self._spread = None if recording is None else as_kind(recording, ChainSpread, "recording", remedy)
        self._chain, self._recorded, self._begun = RecordingChain(), RecordingState(), 0
        self._average = as_flag(average, "average")
        self._joints = dict(as_kind(joints or {}, dict, "joints", "give a dict from bodies to springs of joints"))
        inner = env.observation_space
        self._is_dict = isinstance(inner, Dict)
        parts = dict(inner.spaces) if isinstance(inner, Dict) else {"observation": inner}
        if "audio" in parts:
            raise SceneError("the observation has 'audio' already", "wrap the environment once")
        self._shape = 1 if self._average else channels_of(self._options["microphone"]), ceil(sr * self._step_s)
        self.observation_space = Dict({**parts, "audio": Box(-np.inf, np.inf, self._shape, np.float32)})

    @property
    def step_s(self) -> Fraction:
        """Simulated time T of one env.step, exactly."""
        return self._step_s

    @property
    def listener(self) -> Listener | None:
        """Listener of this episode; None before the first."""
        return self._listener

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[dict[str, Any], Any]:
        """Begin an episode: its audio is silent, its count 0.

        Raises
        ------
        SceneError
            There is no client; and what `Listener.add` raises.
        """
        observation, info = self.env.reset(seed=seed, options=options)
        self._listen()
        self._episodes.begin(None if options else seed)
        info = {**info, "audio_count": 0}
        if self._spread is not None:
            number = [0, self._begun] if seed is None else [1, seed]
            draw = np.random.default_rng([self._options["seed"], *number])
            self._chain, self._recorded = draw_chain(draw, self._spread), RecordingState()
            info["recording"] = self._chain.to_json()
        for body, springs in self._joints.items():
            self._world.hold_joints(body, springs, self._chain.joint_factor)
        self._begun += 1
        return self._with_audio(observation, np.zeros(self._shape, np.float32)), info

    def step(self, action: Any) -> tuple[dict[str, Any], Any, bool, bool, dict[str, Any]]:
        """Step the environment and observe its sound.

        Raises
        ------
        SceneError
            It takes longer than T, or physics steps have another length.
        """
        if self._listener is None:
            raise SceneError("no episode has begun", "call reset first")
        world = self._world
        self._listener.read()  # the sound of steps outside of env.step is part of no observation
        world.steps.clear()
        with self._listener.together(), world.listen_within(self._listener.step):
            observation, reward, terminated, truncated, info = self.env.step(action)
        self._check_steps()
        new = self._listener.read()
        if self._average:
            new = new.mean(axis=0, keepdims=True)
        if self._spread is not None:
            new, self._recorded = record(new, self._options["sr"], self._chain, None, self._recorded)
        audio = np.zeros(self._shape, np.float32)
        audio[:, audio.shape[1] - new.shape[1] :] = new
        info = {**info, "audio_count": new.shape[1]}
        if self._episodes.seeded and self._episodes.differ(self._action_bytes(action), world.steps):
            info["contacts_differ"] = True
        return self._with_audio(observation, audio), reward, terminated, truncated, info

    def close(self) -> None:
        """Remove the hooks from the client, then close the environment."""
        self._detach()
        self.env.close()

    def _listen(self) -> None:
        """Start to listen from here on, without earlier sound."""
        client = connected_client(self.env, self._client)
        cast = cast_of(self._materials, client)
        if self._begun_anew(client, cast):
            return
        self._detach()
        self._world = episode_world(client)
        listener = attach(self._world, keep_log=False, keep_sound=False, **self._options)
        try:
            if isinstance(self._materials, Material):
                self._left_out = add_fillable(listener, self._world, cast, self._silent)
            else:
                listener.add_all(cast)
        except BaseException:
            listener.detach()
            raise
        self._listener, self._cast, self._added = listener, cast, len(self._world.bodies)

    def _begun_anew(self, client: Any, cast: Cast) -> bool:
        """Reset the present listener, if its bodies are those of the cast and all still there; return whether they are.

        Without hooks removals are not observed.
        """
        if self._listener is None or not self._world.hooked or not same_client(self._world.client, client):
            return False
        if not same_cast(cast, self._cast):
            return False
        if any(self._world.likeness(*who) not in self._silent for who in self._left_out):
            return False
        self._listener.reset()
        return len(self._world.bodies) == self._added

    def _action_bytes(self, action: Any) -> bytes:
        """Return an action as bytes; all that cannot be flattened are equal, and contacts then may differ."""
        space = self.action_space
        return np.asarray(flatten(space, action)).tobytes() if space.is_np_flattenable else b""

    def _detach(self) -> None:
        if self._listener is not None:
            self._listener.detach()
            self._listener = None

    def _check_steps(self) -> None:
        """Raise SceneError unless the steps have the same length as before, and fit into T."""
        steps = self._world.steps
        if steps and not self._dt_s:
            self._dt_s, self._most = steps[0].dt_s, int(self._step_s / exact_step(steps[0].dt_s))
        for step in steps:
            if step.dt_s != self._dt_s:
                raise SceneError(
                    f"the environment changed its time step from {self._dt_s:g} s to {step.dt_s:g} s",
                    "keep one time step, or wrap the environment anew",
                )
        if len(steps) > self._most:
            raise SceneError(
                f"an env.step took {len(steps)} physics steps, and its audio holds {self._most}",
                f"give step_s=, the longest that one takes: {len(steps) * self._dt_s:g}",
            )

    def _with_audio(self, observation: Any, audio: Array) -> dict[str, Any]:
        return {**(observation if self._is_dict else {"observation": observation}), "audio": audio}


def as_length(step_s: object) -> float:
    """Return T as given; raises SceneError."""
    return as_number(step_s, "step_s", "give seconds of physics an env.step takes", above=0, most=1e3, error=SceneError)
