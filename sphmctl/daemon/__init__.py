"""Plays a plan on both devices: session, streaming, supervision and the record of a run."""
