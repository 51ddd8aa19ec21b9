"""Classifiers: scikit-learn's on statistics of the log-mel picture, and a convolutional net of 24,000 weights on it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np

from sonic_bullet.records import Array
from studies.sim_to_real.features import FLOOR_DB, statistics


class Classifier(Protocol):
    """Learns from pictures (n, b, t) and names (n,), and names pictures."""

    def fit(self, pictures: Array, names: Array) -> Any: ...

    def predict(self, pictures: Array) -> Array: ...


class OnStatistics:
    """A scikit-learn classifier on standardised statistics."""

    def __init__(self, model: Any) -> None:
        from sklearn.pipeline import make_pipeline
        from sklearn.preprocessing import StandardScaler

        self.model = make_pipeline(StandardScaler(), model)

    def fit(self, pictures: Array, names: Array) -> OnStatistics:
        self.model.fit(statistics(pictures), names)
        return self

    def predict(self, pictures: Array) -> Array:
        return np.asarray(self.model.predict(statistics(pictures)))


class SmallNet:
    """Three convolutions, the mean over time, one linear layer; trained with shifts in pitch, time and level."""

    def __init__(self, epochs: int = 40, seed: int = 0) -> None:
        self.epochs, self.seed = epochs, seed

    def fit(self, pictures: Array, names: Array) -> SmallNet:
        import torch
        from torch import nn

        torch.manual_seed(self.seed)
        torch.set_num_threads(1)
        self.names, target = np.unique(names, return_inverse=True)
        blocks: list[Any] = []
        for before, after in ((1, 16), (16, 32), (32, 64)):
            blocks += [nn.Conv2d(before, after, 3, padding=1), nn.BatchNorm2d(after), nn.ReLU(), nn.MaxPool2d(2)]
        self.net = nn.Sequential(*blocks, nn.AdaptiveAvgPool2d((2, 1)), nn.Flatten(), nn.Dropout(0.3),
                                 nn.Linear(128, len(self.names)))  # fmt: skip
        x, y = self._as_input(pictures), torch.tensor(target)
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

    def predict(self, pictures: Array) -> Array:
        import torch

        with torch.no_grad():
            return np.asarray(self.names[self.net(self._as_input(pictures)).argmax(1).numpy()])

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

    return OnStatistics(LogisticRegression(C=0.02, class_weight="balanced", max_iter=3000))


def _trees() -> Classifier:
    from sklearn.ensemble import ExtraTreesClassifier

    return OnStatistics(ExtraTreesClassifier(400, min_samples_leaf=2, class_weight="balanced", random_state=0))


def _vectors() -> Classifier:
    from sklearn.svm import SVC

    return OnStatistics(SVC(C=3.0, class_weight="balanced"))


MODELS: Mapping[str, Callable[[], Classifier]] = {
    "logistic regression": _logistic, "trees": _trees, "support vectors": _vectors, "small net": SmallNet,
}  # fmt: skip
