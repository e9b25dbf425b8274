# For hands that type make; everything is in ./run.
demo test bench lint engines setup:
	./run $@
.PHONY: demo test bench lint engines setup
