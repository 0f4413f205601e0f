"""Claims: one shape, one way to judge. Those of a publication come with its benchmark."""

from scenarios.results.claims.claim import Claim, Verdict, judge

__all__ = ["Claim", "Verdict", "judge"]
