/* scanhead list: head profiles, kinds of links, and the heads that USB shows. */
#include <stdio.h>
#include <string.h>

#include "drivers/host/scanhead.h"
#include "firmware_sim/app/app.h"

enum { MAX_HEADS = 64 };

static void print_head(const struct scanhead_usb_head *head)
{
    printf("%-32s bus %d device %d", head->source, head->bus, head->device);
    if (head->speed_bit_s > 0.0) printf(", %g Mbit/s", 1e-6 * head->speed_bit_s);
    if (head->maker[0] != '\0' || head->product[0] != '\0') printf(", %s %s", head->maker, head->product);
    printf(head->problem[0] != '\0' ? "; %s\n" : "\n", head->problem);
}

static int list_usb(void)
{
    static struct scanhead_usb_head head[MAX_HEADS];
    char why[256];
    int n = scanhead_list_usb(head, MAX_HEADS, why, sizeof why);
    if (n < 0)
        printf("heads on USB: %s\n", why); /* a system without USB has a list all the same */
    else
        puts(n == 0 ? "heads on USB: none" : "heads on USB:");
    for (int i = 0; i < n && i < MAX_HEADS; i++)
        print_head(&head[i]);
    if (n > MAX_HEADS) printf("and %d more\n", n - MAX_HEADS);
    return APP_OK;
}

int app_list(int argc, char **argv)
{
    if (argc == 2 && (strcmp(argv[1], "--help") == 0 || strcmp(argv[1], "-h") == 0)) {
        puts("scanhead list: head profiles ($SCANHEAD_HEADS, else the installed ones, else config/heads), kinds of "
             "links, "
             "and the heads that USB shows");
        return APP_OK;
    }
    if (argc != 1) return app_usage("list", "it takes no arguments");
    struct sh_err err = {0};
    if (config_list_profiles(NULL, stdout, &err) < 0) return app_fail(&err);
    puts("links: pty (virtual serial port), tcp, usb (usbip, usbredir, functionfs), file, null");
    return list_usb();
}
