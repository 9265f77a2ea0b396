/* SPDX-License-Identifier: MIT */
#include "tests/unit/clock_rig.h"

#include "firmware_sim/base/clock.h"

int64_t clock_rig_ns, clock_rig_each_ns;
double clock_rig_cpu_s;

int64_t clock_now_ns(void)
{
    clock_rig_ns += clock_rig_each_ns;
    return clock_rig_ns - clock_rig_each_ns;
}

void clock_sleep_until_ns(int64_t t_ns)
{
    if (t_ns > clock_rig_ns) clock_rig_ns = t_ns;
}

double clock_cpu_s(void)
{
    return clock_rig_cpu_s;
}
