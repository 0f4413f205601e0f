"""Records as the page shows them: the state of a run at any time of it, and the cases of a run folder."""
