/* SPDX-License-Identifier: MIT */
/* The USB identity of a usb link: the device whose protocol it speaks, with that device's ids where none are given. */
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/usb/personalities.h"
#include "firmware_sim/config/check_links.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/table/given.h"

/* Protocols other than these two and native are refused (link_protocol.c). */
static enum usb_personality_id personality_of(int protocol)
{
    return protocol == PROTOCOL_SCIP   ? USB_PERSONALITY_HOKUYO
           : protocol == PROTOCOL_COLA ? USB_PERSONALITY_SICK
                                       : USB_PERSONALITY_NATIVE;
}

void cfg_set_usb_identity(struct cfg_reader *rd, const struct config *cfg, struct link_spec *link, uint32_t item)
{
    const enum usb_personality_id id = personality_of(link->protocol);
    const struct usb_personality *personality = usb_personality_get(id);
    char path[PATH_MAX];
    link->personality = (int)id;
    if (!cfg_is_item_given(rd, "links[].vid", item)) link->vid = personality->vid;
    if (!cfg_is_item_given(rd, "links[].pid", item)) link->pid = personality->pid;
    if (link->serial[0] != '\0') return;
    snprintf(link->serial, sizeof link->serial, "%s", cfg->head.serial);
    link->own_serial = !cfg_is_given(rd, "head.serial");
    /* `whose` identifies the head: the configuration's file and the link's place in it. */
    const char *file = realpath(cfg->file, path) != NULL ? path : cfg->file;
    const size_t len = strlen(file), most = sizeof link->whose - 12; /* long paths differ mostly at their ends */
    snprintf(link->whose, sizeof link->whose, "%u %.*s", item, (int)most - 1,
             len < most ? file : file + len - most + 1);
}
