# All backends on one model, and the list of devices.
tg_add_test(devices_test LIBRARIES tg_render_devices SOURCES trained_model_test.cpp devices_test.cpp)
