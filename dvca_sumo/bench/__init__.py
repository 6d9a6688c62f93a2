"""The paper's evaluation: cases with a known defect, and how well the analysis finds it."""
