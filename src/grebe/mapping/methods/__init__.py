"""Map methods: each is fitted to readings and returns a field to query."""
