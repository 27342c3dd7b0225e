"""The paper's study, Section 3: tables, figures and a page from one recording fitted and one verified."""
