tg_add_test(cpu_renderer_test LIBRARIES tg_render tg_simd SOURCES
  affine_test.cpp
  cpu_renderer_test.cpp cpu_settings_test.cpp)
