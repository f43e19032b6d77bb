"""Pictures of plans: charts as SVG, and the robot moving along in one HTML file."""
