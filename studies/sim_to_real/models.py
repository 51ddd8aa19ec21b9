"""Classifiers: of scikit-learn, on statistics of the picture, its decays or lines' loss; a net of 24,000 weights."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, Protocol

import numpy as np

from sonic_bullet.records import Array
from studies.sim_to_real.features import FLOOR_DB, decays_of, statistics


class Seen(NamedTuple):
    """What a classifier sees of n sounds: pictures (n, b, t), lines (n, 8) and losses (n, 31)."""

    pictures: Array
    lines: Array
    losses: Array


class Classifier(Protocol):
    """Learns from sounds and their names (n,), and gives each sound its classes' probabilities (n, c), or votes."""

    names: Array

    def fit(self, seen: Seen, names: Array) -> Any: ...

    def chances(self, seen: Seen) -> Array: ...


def statistics_seen(seen: Seen) -> Array:
    """Return the statistics of the pictures (n, f)."""
    return statistics(seen.pictures)


def decays_seen(seen: Seen) -> Array:
    """Return decays and lines (n, f)."""
    return np.hstack([np.array([decays_of(one) for one in seen.pictures]), seen.lines])


def losses_seen(seen: Seen) -> Array:
    """Return the losses (n, 31); NaN where nothing rings."""
    return seen.losses


class OnFeatures:
    """A scikit-learn classifier on standardised features; what is missing has the middle of the others."""

    def __init__(self, features: Callable[[Seen], Array], model: Any) -> None:
        from sklearn.impute import SimpleImputer
        from sklearn.pipeline import make_pipeline
        from sklearn.preprocessing import StandardScaler

        self.features, self.model = features, make_pipeline(SimpleImputer(strategy="median"), StandardScaler(), model)

    def fit(self, seen: Seen, names: Array) -> OnFeatures:
        self.model.fit(self.features(seen), names)
        self.names = self.model.classes_
        return self

    def chances(self, seen: Seen) -> Array:
        features = self.features(seen)
        if hasattr(self.model, "predict_proba"):
            return np.asarray(self.model.predict_proba(features))
        votes = np.exp(self.model.decision_function(features))  # one against the others
        return np.asarray(votes / votes.sum(axis=1, keepdims=True))


class SmallNet:
    """Three convolutions, the mean over time, one linear layer; trained with shifts in pitch, time and level."""

    def __init__(self, epochs: int = 20, seed: int = 0) -> None:
        self.epochs, self.seed = epochs, seed

    def fit(self, seen: Seen, names: Array) -> SmallNet:
        import torch
        from torch import nn

        torch.manual_seed(self.seed)
        torch.set_num_threads(1)
        self.names, target = np.unique(names, return_inverse=True)
        blocks: list[Any] = []
        for before, after in ((1, 16), (16, 32), (32, 64)):
            blocks += [nn.Conv2d(before, after, 3, 2, 1), nn.BatchNorm2d(after), nn.ReLU()]
        self.net = nn.Sequential(*blocks, nn.AdaptiveAvgPool2d((2, 1)), nn.Flatten(), nn.Dropout(0.3),
                                 nn.Linear(128, len(self.names)))  # fmt: skip
        x, y = self._as_input(seen.pictures), torch.tensor(target)
        share = torch.bincount(y).float()
        loss = nn.CrossEntropyLoss(weight=share.sum() / (len(share) * share))
        step = torch.optim.AdamW(self.net.parameters(), 2e-3, weight_decay=1e-2)
        plan = torch.optim.lr_scheduler.OneCycleLR(step, 4e-3, total_steps=self.epochs * -(-len(x) // 32))
        rng = np.random.default_rng(self.seed)
        self.net.train()
        for _ in range(self.epochs):
            for batch in np.array_split(rng.permutation(len(x)), -(-len(x) // 32)):
                step.zero_grad()
                loss(self.net(self._moved(x[batch], rng)), y[batch]).backward()
                step.step()
                plan.step()
        self.net.eval()
        return self

    def chances(self, seen: Seen) -> Array:
        import torch

        with torch.no_grad():
            return np.asarray(self.net(self._as_input(seen.pictures)).softmax(1).numpy())

    @staticmethod
    def _as_input(pictures: Array) -> Any:
        import torch

        return torch.tensor(np.asarray(pictures, np.float32)[:, None] / -FLOOR_DB + 1)

    @staticmethod
    def _moved(x: Any, rng: np.random.Generator) -> Any:
        """Shift by up to three bands and two frames, tilt by up to 3 dB, raise the floor by up to 20 dB."""
        import torch

        x = torch.roll(x, (int(rng.integers(-3, 4)), int(rng.integers(-2, 3))), (2, 3))
        tilt = torch.linspace(-1, 1, x.shape[2])[None, None, :, None] * float(rng.uniform(-0.05, 0.05))
        floor = torch.tensor(rng.uniform(0, 0.33, len(x)), dtype=torch.float32)[:, None, None, None]
        return torch.maximum(x + tilt, floor)


def _logistic() -> Classifier:
    from sklearn.linear_model import LogisticRegression

    return OnFeatures(statistics_seen, LogisticRegression(C=0.02, class_weight="balanced", max_iter=3000))


def _trees() -> Classifier:
    return OnFeatures(statistics_seen, _forest())


def _trees_on_decays() -> Classifier:
    return OnFeatures(decays_seen, _forest())


def _trees_on_losses() -> Classifier:
    return OnFeatures(losses_seen, _forest())


def _forest() -> Any:
    from sklearn.ensemble import ExtraTreesClassifier

    return ExtraTreesClassifier(400, min_samples_leaf=2, class_weight="balanced", random_state=0)


def _vectors() -> Classifier:
    from sklearn.svm import SVC

    return OnFeatures(decays_seen, SVC(C=3.0, class_weight="balanced"))


def _vectors_on_losses() -> Classifier:
    from sklearn.svm import SVC

    return OnFeatures(losses_seen, SVC(C=3.0, class_weight="balanced"))


MODELS: Mapping[str, Callable[[], Classifier]] = {
    "logistic regression": _logistic, "trees": _trees, "trees on decays": _trees_on_decays,
    "support vectors on decays": _vectors, "trees on losses": _trees_on_losses,
    "support vectors on losses": _vectors_on_losses, "small net": SmallNet,
}  # fmt: skip
