"""Files of laboratories: whatever a table, a map or an instrument's file may look like, it becomes
the canonical table that the core reads.

A table passes `reading` (rows of texts), `header` (names), `columns` (their meanings and units),
`cleaning` (rows that are measurements, cells that are numbers), `means` (standard errors) and
`canonical` (the table that is written).
"""
