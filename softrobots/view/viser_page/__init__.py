"""The viser page of `softrobots.view.slider_page`: server, sliders, and drawing."""
