/* SPDX-License-Identifier: MIT */
#include "core/embree.h"

#include <stdio.h>

#include "core/bvh.h"
#include "core/bvh/meet.h"

int embree_fail(enum RTCError code, struct sh_err *err)
{
    if (code == RTC_ERROR_OUT_OF_MEMORY)
        return sh_fail(err, SH_ENOMEM, "bvh: no memory; mesh and BVH take 120 to 300 bytes for each triangle");
    if (code == RTC_ERROR_UNSUPPORTED_CPU)
        return sh_fail(err, SH_EIO, "bvh: this build of Embree doesn't support this processor");
    return sh_fail(err, SH_EIO, "bvh: Embree failed (RTCError %d)", (int)code);
}

int embree_has_packet(RTCDevice device, uint32_t rays)
{
    const enum RTCDeviceProperty asked = rays == 16  ? RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED
                                         : rays == 8 ? RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED
                                                     : RTC_DEVICE_PROPERTY_NATIVE_RAY4_SUPPORTED;
    return (rays < BVH_PACKET || bvh_has_wide()) && rtcGetDeviceProperty(device, asked) != 0;
}

uint32_t embree_packet(RTCDevice device)
{
    for (uint32_t rays = 16; rays >= 4; rays /= 2)
        if (embree_has_packet(device, rays)) return rays;
    return 1;
}

/* Returns the widest instruction set of this processor for which Embree has kernels. */
static const char *instructions(void)
{
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx512f")) return "AVX-512";
    if (__builtin_cpu_supports("avx2")) return "AVX2";
    if (__builtin_cpu_supports("avx")) return "AVX";
    return __builtin_cpu_supports("sse4.2") ? "SSE4.2" : "SSE2";
#elif defined(__aarch64__)
    return "NEON";
#else
    return "plain";
#endif
}

int bvh_engine(char *text, size_t len, struct sh_err *err)
{
    text[0] = '\0';
    RTCDevice device = rtcNewDevice("tessellation_cache_size=1,threads=1");
    if (device == NULL) return embree_fail(rtcGetDeviceError(NULL), err);
    const int version = (int)rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_VERSION);
    snprintf(text, len, "Embree %d.%d.%d, packets of %u, %s", version / 10000, version / 100 % 100, version % 100,
             embree_packet(device), instructions());
    rtcReleaseDevice(device);
    return SH_OK;
}
