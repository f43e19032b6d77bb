"""Pictures of plans: charts as SVG, and the robot moving along in one HTML file."""

from sphmctl.pictures.figures import Binding, Limits, Margin
from sphmctl.pictures.plot import plot
from sphmctl.pictures.view import view

__all__ = ["Binding", "Limits", "Margin", "plot", "view"]
