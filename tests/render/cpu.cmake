tg_add_test(cpu_renderer_test LIBRARIES tg_render hwy::hwy SOURCES
  cpu_renderer_test.cpp cpu_settings_test.cpp)
