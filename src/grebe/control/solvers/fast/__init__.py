"""The fast path: structured SQP with compiled derivatives and a Riccati interior point."""
