"""The viser page of `softrobots.view.slider_page`: its server, its sliders, and what is drawn on it."""
