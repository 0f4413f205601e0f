"""The numbers of a run by hand, beside its history: how far it is its scenario's, and what it measures up to there."""
