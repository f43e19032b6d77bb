"""The board's firmware as a file: built, flashed, compared with what a board runs."""
