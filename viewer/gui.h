// SPDX-License-Identifier: Apache-2.0
// Dear ImGui's context and backends for one window: fonts, colours, life and death. No widgets here.
#pragma once
#include <vulkan/vulkan.h>

#include "viewer/presenter.h"

struct GLFWwindow;

namespace tg {

class Gui {
 public:
  // Callbacks that the window has set before keep being called.
  Gui(GLFWwindow* window, VulkanDevice& device, Presenter& presenter);
  ~Gui();
  Gui(const Gui&) = delete;
  Gui& operator=(const Gui&) = delete;

  void beginFrame();
  void endFrame();                        // no widgets after this
  void record(VkCommandBuffer commands);  // may be called again for the same frame

 private:
  VulkanDevice& device_;
  VkDescriptorPool pool_ = VK_NULL_HANDLE;
};

}  // namespace tg
