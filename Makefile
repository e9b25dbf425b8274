# For hands that type make; everything is in ./run.
demo test bench lint docs reference wheel live engines setup:
	./run $@
.PHONY: demo test bench lint docs reference wheel live engines setup
