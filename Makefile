# For hands that type make; everything is in ./run.
demo test bench lint docs reference engines setup:
	./run $@
.PHONY: demo test bench lint docs reference engines setup
