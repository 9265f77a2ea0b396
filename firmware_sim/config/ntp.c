/* SPDX-License-Identifier: MIT */
#include <arpa/inet.h>
#include <math.h>

#include "drivers/protocol/protocol.h"
#include "firmware_sim/config/check.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/table/given.h"

void cfg_check_ntp(struct cfg_reader *rd, const struct config *cfg)
{
    const struct config_ntp *ntp = &cfg->ntp;
    struct in_addr address;
    char shown[CFG_SHOW_MAX];
    if (inet_pton(AF_INET, ntp->address, &address) != 1)
        cfg_fail_key(rd, "ntp.address", "\"%s\"; allowed a numeric IPv4 address such as 127.0.0.1",
                     cfg_show(ntp->address, shown));
    if (floor(ntp->zone_h) != ntp->zone_h)
        cfg_fail_key(rd, "ntp.zone_h", "%.10g; allowed whole hours from -12 to 12", ntp->zone_h);
    if (ntp->role == NTP_ROLE_CLIENT && !cfg->links_are_not_here && !config_speaks(cfg, PROTOCOL_COLA) &&
        CFG_SOUND(rd, "ntp.role", "links"))
        cfg_fail_key(rd, "ntp.role", "client, but no link sends dates; allowed with a link of protocol: cola");
    if (ntp->role == NTP_ROLE_CLIENT && cfg->loop.pace != PACE_REALTIME && CFG_SOUND(rd, "ntp.role", "loop.pace"))
        cfg_fail_key(rd, "ntp.role", "client, but loop.pace is %s; allowed with realtime, as a server's time runs on",
                     cfg_word(rd, "loop.pace", (int)cfg->loop.pace));
}
