"""Run by hand: documentation made from schemas, campaigns, scores."""
