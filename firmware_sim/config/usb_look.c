/* Which device a usb link shows itself as: that whose protocol it speaks, with that device's ids where none are given. */
#include "drivers/usb/looks.h"
#include "firmware_sim/config/table.h"

static enum usb_look_id look_of(int protocol)
{
    switch (protocol) {
    case PROTOCOL_SCIP:
        return USB_LOOK_HOKUYO;
    case PROTOCOL_COLA:
        return USB_LOOK_SICK;
    default: /* native; the others are refused (link_protocol.c) */
        return USB_LOOK_NATIVE;
    }
}

void cfg_set_usb_look(struct cfg_reader *rd, struct link_spec *link, uint32_t item)
{
    const struct usb_look *look = usb_look_get(look_of(link->protocol));
    link->look = (int)look_of(link->protocol);
    if (!cfg_is_given(rd, "links[].vid", item)) link->vid = look->vid;
    if (!cfg_is_given(rd, "links[].pid", item)) link->pid = look->pid;
}
