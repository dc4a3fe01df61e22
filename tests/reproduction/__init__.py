"""The paper by one command: both case studies, the claim that choosing simulations saves most of
them, and the page that compares every equation, figure and table with the paper's.
"""
