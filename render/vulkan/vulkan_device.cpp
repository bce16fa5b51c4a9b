// SPDX-License-Identifier: Apache-2.0
// Instance, device, queue and validation messages.
#include "render/vulkan/vulkan_device.h"

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <optional>
#include <utility>

#include "core/system/error.h"
#include "render/gpu/shaders.h"
#include "render/vulkan/check.h"

namespace tg {
namespace {

constexpr const char* kValidationLayer = "VK_LAYER_KHRONOS_validation";
constexpr const char* kPortabilitySubset = "VK_KHR_portability_subset";  // of a device: Vulkan but for a few features
// Texel buffers of fewer elements, Vulkan's least being 65,536, are too few for models of today.
constexpr std::uint32_t kEnoughTexels = 1u << 24;
constexpr std::uint32_t kLargestTexel = 16;         // [bytes]
constexpr std::uint32_t kWidestGroup = 256;         // threads
constexpr std::uint32_t kSharedMemory = 20 * 1024;  // [bytes] of the pass with the most (sort_scatter)

constexpr std::pair<VkResult, const char*> kResults[] = {{VK_ERROR_OUT_OF_HOST_MEMORY, "out of host memory"},
                                                         {VK_ERROR_OUT_OF_DEVICE_MEMORY, "out of device memory"},
                                                         {VK_ERROR_INITIALIZATION_FAILED, "initialization failed"},
                                                         {VK_ERROR_DEVICE_LOST, "device lost"},
                                                         {VK_ERROR_MEMORY_MAP_FAILED, "memory map failed"},
                                                         {VK_ERROR_LAYER_NOT_PRESENT, "layer not present"},
                                                         {VK_ERROR_EXTENSION_NOT_PRESENT, "extension not present"},
                                                         {VK_ERROR_FEATURE_NOT_PRESENT, "feature not present"},
                                                         {VK_ERROR_INCOMPATIBLE_DRIVER, "no Vulkan driver"},
                                                         {VK_ERROR_TOO_MANY_OBJECTS, "too many objects"},
                                                         {VK_ERROR_SURFACE_LOST_KHR, "surface lost"}};

const char* resultName(VkResult result) {
  const auto* found = std::ranges::find(kResults, result, &std::pair<VkResult, const char*>::first);
  return found == std::end(kResults) ? "error" : found->second;
}

// A device plus what only its destruction needs.
struct OwnedDevice : VulkanDevice {
  VkDebugUtilsMessengerEXT messenger = VK_NULL_HANDLE;
};

template <typename Function>
Function instanceFunction(VkInstance instance, const char* name) {
  return reinterpret_cast<Function>(vkGetInstanceProcAddr(instance, name));
}

void destroyDevice(VulkanDevice* base) {
  auto* device = static_cast<OwnedDevice*>(base);
  if (device->device) {
    vkDeviceWaitIdle(device->device);
    vkDestroyDevice(device->device, nullptr);
  }
  if (device->surface) vkDestroySurfaceKHR(device->instance, device->surface, nullptr);
  if (device->messenger) {
    instanceFunction<PFN_vkDestroyDebugUtilsMessengerEXT>(device->instance, "vkDestroyDebugUtilsMessengerEXT")(
        device->instance, device->messenger, nullptr);
  }
  if (device->instance) vkDestroyInstance(device->instance, nullptr);
  delete device;
}

// Printed at once as well as kept: what the layer says while the device is destroyed has no other reader.
VKAPI_ATTR VkBool32 VKAPI_CALL keepMessage(VkDebugUtilsMessageSeverityFlagBitsEXT, VkDebugUtilsMessageTypeFlagsEXT,
                                           const VkDebugUtilsMessengerCallbackDataEXT* data, void* user) {
  auto* device = static_cast<VulkanDevice*>(user);
  const std::lock_guard lock(device->messages_mutex);
  device->validation_messages.emplace_back(data->pMessage);
  std::fprintf(stderr, "vulkan: %s\n", data->pMessage);
  return VK_FALSE;
}

VkDebugUtilsMessengerCreateInfoEXT messengerInfo(VulkanDevice& device) {
  VkDebugUtilsMessengerCreateInfoEXT info{VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT};
  info.messageSeverity =
      VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT;
  info.messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT;
  info.pfnUserCallback = keepMessage;
  info.pUserData = &device;
  return info;
}

bool hasValidationLayer() {
  std::uint32_t count = 0;
  TG_VK(vkEnumerateInstanceLayerProperties(&count, nullptr));
  std::vector<VkLayerProperties> layers(count);
  TG_VK(vkEnumerateInstanceLayerProperties(&count, layers.data()));
  return std::any_of(layers.begin(), layers.end(),
                     [](const VkLayerProperties& layer) { return !std::strcmp(layer.layerName, kValidationLayer); });
}

// The loader can show devices that are Vulkan but for a few features, none of which a pass needs.
bool listsPortabilityDevices() {
  std::uint32_t count = 0;
  TG_VK(vkEnumerateInstanceExtensionProperties(nullptr, &count, nullptr));
  std::vector<VkExtensionProperties> known(count);
  TG_VK(vkEnumerateInstanceExtensionProperties(nullptr, &count, known.data()));
  return std::any_of(known.begin(), known.end(), [](const VkExtensionProperties& extension) {
    return !std::strcmp(extension.extensionName, VK_KHR_PORTABILITY_ENUMERATION_EXTENSION_NAME);
  });
}

void createInstance(const VulkanOptions& options, OwnedDevice& device) {
  device.validation = options.validation && hasValidationLayer();
  std::vector<const char*> extensions = options.instance_extensions;
  const bool portability = listsPortabilityDevices();
  if (portability) extensions.push_back(VK_KHR_PORTABILITY_ENUMERATION_EXTENSION_NAME);
  if (device.validation) extensions.push_back(VK_EXT_DEBUG_UTILS_EXTENSION_NAME);

  VkApplicationInfo application{VK_STRUCTURE_TYPE_APPLICATION_INFO};
  application.pApplicationName = "textured_gaussians";
  application.apiVersion = VK_API_VERSION_1_1;
  VkInstanceCreateInfo info{VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO};
  info.pApplicationInfo = &application;
  if (portability) info.flags = VK_INSTANCE_CREATE_ENUMERATE_PORTABILITY_BIT_KHR;
  info.enabledExtensionCount = static_cast<std::uint32_t>(extensions.size());
  info.ppEnabledExtensionNames = extensions.data();

  const VkValidationFeatureEnableEXT synchronization = VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT;
  VkValidationFeaturesEXT features{VK_STRUCTURE_TYPE_VALIDATION_FEATURES_EXT};
  features.enabledValidationFeatureCount = 1;
  features.pEnabledValidationFeatures = &synchronization;
  VkDebugUtilsMessengerCreateInfoEXT messenger = messengerInfo(device);
  if (device.validation) {
    info.enabledLayerCount = 1;
    info.ppEnabledLayerNames = &kValidationLayer;
    features.pNext = &messenger;  // also hears what happens before and after the messenger's life
    info.pNext = &features;
  }
  TG_VK(vkCreateInstance(&info, nullptr, &device.instance));
  if (device.validation) {
    messenger.pNext = nullptr;
    TG_VK(instanceFunction<PFN_vkCreateDebugUtilsMessengerEXT>(device.instance, "vkCreateDebugUtilsMessengerEXT")(
        device.instance, &messenger, nullptr, &device.messenger));
  }
}

// The first queue family that runs the passes; with a surface, one that also draws panels and presents.
std::optional<std::uint32_t> findQueueFamily(VkPhysicalDevice physical, VkSurfaceKHR surface) {
  std::uint32_t count = 0;
  vkGetPhysicalDeviceQueueFamilyProperties(physical, &count, nullptr);
  std::vector<VkQueueFamilyProperties> families(count);
  vkGetPhysicalDeviceQueueFamilyProperties(physical, &count, families.data());
  const VkQueueFlags wanted = VK_QUEUE_COMPUTE_BIT | (surface ? VK_QUEUE_GRAPHICS_BIT : 0);  // both imply transfer
  for (std::uint32_t i = 0; i < count; ++i) {
    VkBool32 presents = VK_TRUE;
    if (surface) TG_VK(vkGetPhysicalDeviceSurfaceSupportKHR(physical, i, surface, &presents));
    if ((families[i].queueFlags & wanted) == wanted && presents) return i;
  }
  return std::nullopt;
}

bool hasExtension(VkPhysicalDevice physical, const char* name) {
  std::uint32_t count = 0;
  TG_VK(vkEnumerateDeviceExtensionProperties(physical, nullptr, &count, nullptr));
  std::vector<VkExtensionProperties> extensions(count);
  TG_VK(vkEnumerateDeviceExtensionProperties(physical, nullptr, &count, extensions.data()));
  return std::any_of(extensions.begin(), extensions.end(), [&](const VkExtensionProperties& extension) {
    return !std::strcmp(extension.extensionName, name);
  });
}

bool readsStorage(const VkPhysicalDeviceLimits& limits) { return limits.maxTexelBufferElements < kEnoughTexels; }

// The most that one pass binds.
std::uint32_t storageBuffersPerStage(bool storage_texels) {
  std::uint32_t most = 0;
  for (const ShaderModule& module : shaderModules()) {
    most = std::max(most, module.buffer_count + (storage_texels ? module.texel_count : 0));
  }
  return most;
}

// Why a device cannot run the passes, or empty.
std::string whatIsMissing(VkPhysicalDevice physical, const VkPhysicalDeviceProperties& properties,
                          const VulkanOptions& options, VkSurfaceKHR surface) {
  if (properties.apiVersion < VK_API_VERSION_1_1) return "Vulkan 1.1";
  if (std::string lacking = whatLimitsLack(properties.limits); !lacking.empty()) return lacking;
  if (!findQueueFamily(physical, surface)) return surface ? "a queue that draws to the window" : "a compute queue";
  if (options.swapchain && !hasExtension(physical, VK_KHR_SWAPCHAIN_EXTENSION_NAME)) {
    return VK_KHR_SWAPCHAIN_EXTENSION_NAME;
  }
  return {};
}

// The best kind of device first.
constexpr VkPhysicalDeviceType kKinds[] = {VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU, VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU,
                                           VK_PHYSICAL_DEVICE_TYPE_VIRTUAL_GPU, VK_PHYSICAL_DEVICE_TYPE_CPU};
std::ptrdiff_t rank(VkPhysicalDeviceType type) { return std::end(kKinds) - std::ranges::find(kKinds, type); }

std::vector<VkPhysicalDevice> physicalDevices(const VulkanDevice& device) {
  std::uint32_t count = 0;
  TG_VK(vkEnumeratePhysicalDevices(device.instance, &count, nullptr));
  std::vector<VkPhysicalDevice> all(count);
  TG_VK(vkEnumeratePhysicalDevices(device.instance, &count, all.data()));
  all.resize(count);
  return all;
}

void pickPhysicalDevice(const VulkanOptions& options, VulkanDevice& device) {
  std::string refused;
  std::ptrdiff_t best = -1;
  const std::vector<VkPhysicalDevice> candidates = physicalDevices(device);
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    VkPhysicalDeviceProperties properties;
    vkGetPhysicalDeviceProperties(candidates[i], &properties);
    const std::string name = properties.deviceName;
    const std::string missing = whatIsMissing(candidates[i], properties, options, device.surface);
    if (options.index ? i != *options.index : name.find(options.device) == std::string::npos) {
      refused += "; \"" + name + "\" has another " + (options.index ? "number" : "name");
    } else if (!missing.empty()) {
      refused += "; \"" + name + "\" lacks " + missing;
    } else if (rank(properties.deviceType) > best) {
      best = rank(properties.deviceType);
      device.physical = candidates[i];
      device.properties = properties;
      device.storage_texels = readsStorage(properties.limits);
    }
  }
  if (best >= 0) return;
  const std::string wanted = options.device.empty() ? "" : " named \"" + options.device + "\"";
  throw Error(ErrorKind::device,
              "Vulkan: no usable device" + wanted + (candidates.empty() ? "; the drivers list none" : refused));
}

void createLogicalDevice(const VulkanOptions& options, VulkanDevice& device) {
  device.queue_family = *findQueueFamily(device.physical, device.surface);
  std::uint32_t count = 0;
  vkGetPhysicalDeviceQueueFamilyProperties(device.physical, &count, nullptr);
  std::vector<VkQueueFamilyProperties> families(count);
  vkGetPhysicalDeviceQueueFamilyProperties(device.physical, &count, families.data());
  // A window has a queue of its own where there is one, before the renderer's: panels must not wait for a picture.
  const bool two = options.swapchain && families[device.queue_family].queueCount > 1;
  const float priorities[] = {two ? 0.5f : 1.0f, 1.0f};
  VkDeviceQueueCreateInfo queue{VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO};
  queue.queueFamilyIndex = device.queue_family;
  queue.queueCount = two ? 2 : 1;
  queue.pQueuePriorities = priorities;
  std::vector<const char*> extensions;
  if (options.swapchain) extensions.push_back(VK_KHR_SWAPCHAIN_EXTENSION_NAME);
  if (hasExtension(device.physical, kPortabilitySubset)) extensions.push_back(kPortabilitySubset);
  VkDeviceCreateInfo info{VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO};
  info.queueCreateInfoCount = 1;
  info.pQueueCreateInfos = &queue;
  info.enabledExtensionCount = static_cast<std::uint32_t>(extensions.size());
  info.ppEnabledExtensionNames = extensions.data();
  TG_VK(vkCreateDevice(device.physical, &info, nullptr, &device.device));
  vkGetDeviceQueue(device.device, device.queue_family, 0, &device.queue);
  vkGetDeviceQueue(device.device, device.queue_family, two ? 1 : 0, &device.window_queue);
}

}  // namespace

void checkVulkan(VkResult result, const char* call) {
  if (result >= 0) return;
  const std::string text(call);
  throw Error(ErrorKind::device, "Vulkan: " + std::string(resultName(result)) + " (" + std::to_string(result) +
                                     ") in " + text.substr(0, text.find('(')));
}

std::unique_ptr<VulkanDevice, void (*)(VulkanDevice*)> createVulkanDevice(const VulkanOptions& options) {
  std::unique_ptr<VulkanDevice, void (*)(VulkanDevice*)> device(new OwnedDevice, destroyDevice);
  createInstance(options, static_cast<OwnedDevice&>(*device));
  if (options.swapchain) device->surface = options.surface(device->instance);
  pickPhysicalDevice(options, *device);
  createLogicalDevice(options, *device);
  return device;
}

std::vector<DeviceInfo> listVulkanDevices() {
  std::unique_ptr<VulkanDevice, void (*)(VulkanDevice*)> device(new OwnedDevice, destroyDevice);
  createInstance({}, static_cast<OwnedDevice&>(*device));
  std::vector<DeviceInfo> infos;
  for (VkPhysicalDevice physical : physicalDevices(*device)) {
    VkPhysicalDeviceProperties properties;
    vkGetPhysicalDeviceProperties(physical, &properties);
    const std::uint32_t version = properties.apiVersion;
    infos.push_back(
        {"Vulkan",
         std::to_string(VK_API_VERSION_MAJOR(version)) + "." + std::to_string(VK_API_VERSION_MINOR(version)) + "." +
             std::to_string(VK_API_VERSION_PATCH(version)),
         properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU, limitsOf(properties, readsStorage(properties.limits)),
         whatIsMissing(physical, properties, {}, VK_NULL_HANDLE)});
  }
  return infos;
}

GpuLimits limitsOf(const VkPhysicalDeviceProperties& properties, bool storage_texels) {
  const VkPhysicalDeviceLimits& limits = properties.limits;
  const std::uint32_t bytes = wholeStorageBytes(limits.maxStorageBufferRange);
  const std::uint32_t texels = storage_texels ? bytes / kLargestTexel : limits.maxTexelBufferElements;
  return {properties.deviceName, bytes, texels, limits.maxImageDimension2D};
}

std::string whatLimitsLack(const VkPhysicalDeviceLimits& limits) {
  const std::uint32_t buffers = storageBuffersPerStage(readsStorage(limits));
  if (limits.maxPerStageDescriptorStorageBuffers < buffers) {
    return std::to_string(buffers) + " storage buffers per stage";
  }
  if (limits.maxComputeWorkGroupInvocations < kWidestGroup || limits.maxComputeWorkGroupSize[0] < kWidestGroup) {
    return "workgroups of " + std::to_string(kWidestGroup) + " threads";
  }
  if (limits.maxComputeSharedMemorySize < kSharedMemory) {
    return std::to_string(kSharedMemory) + " bytes of shared memory";
  }
  return {};
}

}  // namespace tg
