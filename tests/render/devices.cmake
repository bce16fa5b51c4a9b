# All backends on one model, and the list of devices.
tg_add_test(test_devices LIBRARIES tg_render_devices SOURCES trained_model_test.cpp devices_test.cpp)
