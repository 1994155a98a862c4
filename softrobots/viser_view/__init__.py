"""The viser page of `softrobots.slider_page`: its server, its sliders, and what is drawn on it."""
