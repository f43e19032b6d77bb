"""What all tests share: Hypothesis judges results, not how long a busy machine takes for them."""

from __future__ import annotations

from hypothesis import settings

settings.register_profile("project", deadline=None)
settings.load_profile("project")
