#include "core/embree.h"

int embree_fail(enum RTCError code, const char *what, struct sh_err *err)
{
    if (code == RTC_ERROR_OUT_OF_MEMORY)
        return sh_fail(err, SH_ENOMEM, "%s: no memory; Embree takes about 150 bytes for each triangle of the scene",
                       what);
    if (code == RTC_ERROR_UNSUPPORTED_CPU)
        return sh_fail(err, SH_EIO, "%s: this build of Embree can't run on this processor", what);
    return sh_fail(err, SH_EIO, "%s: Embree failed (RTCError %d)", what, (int)code);
}
