"""Who may do what: the gate, the table of roles, tokens, and how often somebody may come."""
