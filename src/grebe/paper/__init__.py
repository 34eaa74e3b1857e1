"""The paper's figures, reproduced: each is drawn, and checked against what it must show."""
