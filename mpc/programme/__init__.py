"""The quadratic programme and the sampling that predictive control stands on."""
