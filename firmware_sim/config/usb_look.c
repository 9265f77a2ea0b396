/* Which device a usb link shows itself as: that whose protocol it speaks, with that device's ids where none are given. */
#include "drivers/usb/looks.h"
#include "firmware_sim/config/table.h"

/* -1: no such device. */
static int look_of(int protocol)
{
    switch (protocol) {
    case PROTOCOL_NATIVE:
        return USB_LOOK_NATIVE;
    case PROTOCOL_SCIP:
        return USB_LOOK_HOKUYO;
    case PROTOCOL_COLA:
        return USB_LOOK_SICK;
    default:
        return -1;
    }
}

int cfg_set_usb_look(struct cfg_reader *rd, struct link_spec *link, uint32_t item)
{
    if (!CFG_SOUND(rd, item, "links[].protocol")) return 0;
    const int id = look_of(link->protocol);
    if (id < 0) {
        cfg_fail_key(rd, "links[].protocol", item, "%s, which no device on USB speaks; allowed native, scip, cola",
                     cfg_word(rd, "links[].protocol", link->protocol));
        return 0;
    }
    const struct usb_look *look = usb_look_get((enum usb_look_id)id);
    link->look = id;
    if (!cfg_is_given(rd, "links[].vid", item)) link->vid = look->vid;
    if (!cfg_is_given(rd, "links[].pid", item)) link->pid = look->pid;
    return 1;
}
