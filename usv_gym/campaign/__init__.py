"""Campaigns: suites of cases times policies times seeds, their verdict and their report."""
