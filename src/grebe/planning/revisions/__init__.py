"""The rest of an order, planned anew while a boat sails."""
