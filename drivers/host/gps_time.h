/* Absolute time for the recorders whose formats have room for it. */
#ifndef DRIVERS_HOST_GPS_TIME_H
#define DRIVERS_HOST_GPS_TIME_H

#include "drivers/host/scanhead.h"

/* Adjusted standard GPS time (GPS seconds - 1e9) of t_ns since the scan's start: 0, or negative when the stream has not
 * said. No frame tells it yet, so no recording has it; this is the one place where it comes in. */
static inline int gps_time_of(const struct scanhead *sh, int64_t t_ns, double *adjusted_s)
{
    (void)sh, (void)t_ns, (void)adjusted_s;
    return SCANHEAD_ESTATE;
}

#endif
