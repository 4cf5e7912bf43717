#!/bin/sh
# Draws the pictures of README.md and of docs/src/figures.md; those of the other pages are drawn and compared by the tests
# (DLSYS_RENEW_GOLDEN=1 cargo test book). Run in the root of the repository: docs/pictures.sh [PROGRAM]
set -eu
program=${1:-dlsys}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

# picture NAME FILE MODEL FLAGS…: renders to docs/src/images/NAME.png; FILE is the name that `render` gives the picture.
picture() {
    name=$1 file=$2 model=$3
    shift 3
    "$program" render "models/$model.dls" -o "$folder/$name" --format png --quiet "$@"
    cp "$folder/$name/$file.png" "docs/src/images/$name.png"
}

portrait="--size 540x600 --perspective 25"
# shellcheck disable=SC2086
{
    picture readme-lychnis frame-0000 lychnis --at 6.6 --view 25,12 $portrait
    picture readme-poppy frame-0000 poppy --at 13.3 --view 155,26 $portrait
    picture readme-pappus frame-0000 hieracium --set n_0=0 --set t_h=8 --set x_th=20 --at 26 --view 0,20 $portrait
    picture readme-sapling frame-0000 sapling --at 16 --view 20,8 $portrait
}
picture readme-meadow frame-0000 meadow --at 1 --size 1200x560
picture campanula grid campanula --from 7 --to 17 --step 1 --layout grid --accuracy 0.02 --width 1000
picture lychnis grid lychnis --from 3 --to 6 --step 0.5 --layout grid --view 25,10 --accuracy 0.02 --width 1000
picture hieracium grid hieracium --set diagram=1 --at 17,26.5,36,40,47,49.6,52 --layout grid --accuracy 0.03 --width 1000
picture flower-campanula grid campanula --set n_0=0 --at 1.5,2.5,3.5,4.5,5.5,6.5,9,10,11.5,13 --layout grid \
    --view 0,15 --accuracy 0.005 --width 1000
picture flower-hieracium grid hieracium --set n_0=0 --set t_h=8 --set x_th=20 --at 4,8,9,10,11,12.5,19,21,23,25.5 \
    --layout grid --view 0,20 --accuracy 0.01 --width 1000
