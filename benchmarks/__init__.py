"""Speed and accuracy of Lobefit, each side by side with what a user would pick instead."""

from __future__ import annotations

__all__: list[str] = []
