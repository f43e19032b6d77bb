"""The two devices, arm and wrist, over byte links; no plan is known here."""
