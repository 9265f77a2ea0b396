/* SPDX-License-Identifier: MIT */
/* This makes Embree use AVX2, with packets of 8, on a processor that has AVX-512 as well. A build of one instruction
 * set (VEC_ONE) is linked with this and with -Wl,--wrap=rtcNewDevice: see make_avx2 in speed.mk. */
#include <stddef.h>
#include <stdio.h>

#include "core/embree.h"

RTCDevice __real_rtcNewDevice(const char *config);
RTCDevice __wrap_rtcNewDevice(const char *config);

RTCDevice __wrap_rtcNewDevice(const char *config)
{
    char with[256];
    snprintf(with, sizeof with, "%s%sisa=avx2", config != NULL ? config : "", config != NULL ? "," : "");
    return __real_rtcNewDevice(with);
}
