"""Seeing and sharing runs: replays for the rerun viewer, pictures without a driver, pages, exports, plots."""
