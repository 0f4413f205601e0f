"""The self-check of links: their configuration beside what they did, for reports and tests. Needs numpy and scipy."""
