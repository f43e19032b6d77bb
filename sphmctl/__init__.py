"""sphmctl plays one path on a KUKA KR6 R900 and the 3-RRS wrist on its flange, in step."""

__version__ = "0.1.0"
