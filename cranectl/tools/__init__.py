"""Tools beside the core: each holds its computation, tables, pages and commands, and knows no other tool."""
