tg_add_test(test_cpu_renderer LIBRARIES tg_render hwy::hwy SOURCES
  cpu_renderer_test.cpp cpu_settings_test.cpp)
