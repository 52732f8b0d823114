% Fixed-point iteration (5.5) with a held boundary, as a MATLAB user would write it: matrices from
% triplets, systems by backslash. In: V (n,3), T (k,4) one-based, B (nb,1) one-based, X (nb,3) images
% of B, c, steps, infile, outfile. Out: Y (n,3), seconds of the steps alone.
1;

function [g, volume] = face_vectors (P, T)
  p1 = P(T(:,1),:);
  u = P(T(:,2),:) - p1;  v = P(T(:,3),:) - p1;  w = P(T(:,4),:) - p1;
  g = zeros (rows (T), 3, 4);
  g(:,:,2) = cross (v, w, 2);
  g(:,:,3) = cross (w, u, 2);
  g(:,:,4) = cross (u, v, 2);
  g(:,:,1) = -sum (g(:,:,2:4), 3);
  volume = dot (u, g(:,:,2), 2) / 6;
end

function L = assemble (g, factor, T, n)
  pairs = nchoosek (1:4, 2);
  i = j = x = [];
  for p = pairs'
    i = [i; T(:,p(1))];
    j = [j; T(:,p(2))];
    x = [x; factor .* dot(g(:,:,p(1)), g(:,:,p(2)), 2)];
  end
  L = sparse (i, j, x, n, n);
  L = L + L';
  L = L - spdiags (full (sum (L, 2)), 0, n, n);
end

load (infile);
n = rows (V);
I = setdiff ((1:n)', B);
[g, rest] = face_vectors (V, T);
Y = zeros (n, 3);
Y(B,:) = X;
L = assemble (g, 1 ./ rest, T, n);
Y(I,:) = L(I,I) \ -(L(I,B) * X);
[g, volume] = face_vectors (Y, T);
tic;
for step = 1:steps
  L = assemble (g, 1 ./ (rest + c * abs (volume)), T, n);
  Y(I,:) = L(I,I) \ -(L(I,B) * X);
  [g, volume] = face_vectors (Y, T);
end
seconds = toc;
save ("-v7", outfile, "Y", "seconds");
