"""From a path to a plan, before anything moves; pure computation, no I/O."""
